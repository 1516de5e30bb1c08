"""What customers, operators and providers read: deliveries, plans, proofs, tracks and earnings."""
