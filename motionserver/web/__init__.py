"""The process that shows and tunes: FastAPI beside the motion, never in its way."""
