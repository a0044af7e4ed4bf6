"""Laws of positions that are passive by their tuning: their answers, their needs, the verdict."""
