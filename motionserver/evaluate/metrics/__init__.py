"""Figures of fidelity and of the workspace, on executed samples."""
