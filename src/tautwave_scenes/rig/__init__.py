"""From a rig's `scene` keys to the network that runs, in one dimension or three."""
