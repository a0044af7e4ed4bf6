"""Connections: TCP and serial ports, exchanges on them, and a blocking client."""
