"""The command line. It starts services as processes and never imports them."""
