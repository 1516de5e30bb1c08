"""Events told again to a webhook that has missed them, under their own ids."""
