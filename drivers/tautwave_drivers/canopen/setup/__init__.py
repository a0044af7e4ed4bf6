"""From power-on to enabled: drives checked, set up, read back and started."""
