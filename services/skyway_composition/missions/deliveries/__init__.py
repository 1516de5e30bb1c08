"""The deliveries that missions are booked for: locked while that is done, and closed for good."""
