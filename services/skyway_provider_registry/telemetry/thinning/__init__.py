"""What is older than a day is kept as minutes, and what is older than a month not at all."""
