"""Clients: senders, replay and device emulators; they know the wire, not the server."""
