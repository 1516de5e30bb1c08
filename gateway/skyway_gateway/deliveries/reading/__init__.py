"""What people read: deliveries, plans, proofs and tracks, earnings and statistics."""
