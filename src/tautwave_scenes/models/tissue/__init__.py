"""Tissue: tetrahedra that turn with their motion, and the discrete gradient of their potential."""
