"""What customers, operators and providers see of deliveries."""
