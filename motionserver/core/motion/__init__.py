"""Playing accepted plans; rest-to-rest moves."""
