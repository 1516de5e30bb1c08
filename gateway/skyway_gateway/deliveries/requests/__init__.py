"""What customers ask for: deliveries are accepted and written once, changed, or cancelled."""
