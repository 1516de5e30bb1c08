"""Between a delivery and its rows: which column holds what."""
