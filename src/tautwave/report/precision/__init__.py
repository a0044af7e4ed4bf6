"""How exact a run was: against its oracle, and at half and double its rate."""
