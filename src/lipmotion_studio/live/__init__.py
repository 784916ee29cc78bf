"""Consumers of live frames over WebSockets: servers that pages connect to, and VTube Studio (needs websockets)."""
