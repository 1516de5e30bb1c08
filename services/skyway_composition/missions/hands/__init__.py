"""What people do to missions by hand: loaders confirm, operators command, customers cancel."""
