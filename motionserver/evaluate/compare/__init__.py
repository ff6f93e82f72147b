"""All recordings of a folder, all algorithms, all rivals, in one table."""
