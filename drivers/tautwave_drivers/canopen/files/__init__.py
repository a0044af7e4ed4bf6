"""EDS and DCF files (CiA 306): read as vendors write them, and what they say of a drive."""
