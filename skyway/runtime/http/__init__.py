"""HTTP between services and from outside: everything that all services do in the same way."""
