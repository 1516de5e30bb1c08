"""What a row holds: its values by the names of their columns."""

Values = dict[str, object]
