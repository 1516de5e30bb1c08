"""HTTP between services and from outside: what all services ask and answer in the same way."""
