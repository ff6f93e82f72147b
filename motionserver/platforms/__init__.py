"""Platform packet formats: one file per machine."""
