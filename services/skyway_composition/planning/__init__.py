"""How a request could be flown: problems, plans and offers. Heavy, and changes nothing."""
