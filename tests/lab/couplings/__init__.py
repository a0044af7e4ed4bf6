"""`python -m tests.lab couplings`: every coupling, bare and in an account, on equal terms."""
