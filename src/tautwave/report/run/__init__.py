"""The report of one run: its directory read, completed, judged and put on a page."""
