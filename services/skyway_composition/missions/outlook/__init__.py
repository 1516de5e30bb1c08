"""Whether a mission's plan still holds, from what its drone last said."""
