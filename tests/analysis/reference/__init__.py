"""Mathematics that no command needs: what tests hold the rest against."""
