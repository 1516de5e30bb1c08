"""What re-composition (`recompose`) looks at, and what it does when there is no plan."""
