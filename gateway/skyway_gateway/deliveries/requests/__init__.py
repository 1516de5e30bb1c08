"""What customers ask for: deliveries are accepted and written once, or cancelled."""
