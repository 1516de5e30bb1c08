"""Messages that leave with a transaction, and are sent until somebody has them."""
