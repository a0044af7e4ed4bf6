"""One of two sites: finding the other, running one end of every pair, losing and regaining it."""
