"""HTTP between services and from outside: what all of them ask and answer alike."""
