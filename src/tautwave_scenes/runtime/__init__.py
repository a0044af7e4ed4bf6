"""A scene in the live loop: axes as its ports, its books, and the guard on held efforts."""
