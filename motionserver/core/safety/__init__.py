"""What may reach the platform: states, supervision, verification."""
