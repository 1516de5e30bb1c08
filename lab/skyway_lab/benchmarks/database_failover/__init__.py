"""PostgreSQL as two servers under Patroni, of which the primary is killed during deliveries."""
