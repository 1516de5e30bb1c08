"""Mission reports from composition: applied once each, and what happens when none arrive."""
