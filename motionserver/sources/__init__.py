"""Ways motion comes in: one file per simulator format."""
