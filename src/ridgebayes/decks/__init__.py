"""Scenes as input decks for other programs."""
