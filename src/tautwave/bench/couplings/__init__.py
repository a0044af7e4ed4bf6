"""`tautwave bench couplings`: every coupling, bare and in an account, on equal terms."""
