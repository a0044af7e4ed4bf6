"""The same scenes by other people's software, where it is installed."""
