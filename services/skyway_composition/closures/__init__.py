"""What happens in the world: closures, outages, zones that appear, ground stops."""
