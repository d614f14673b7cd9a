"""Damages: each changes a copied folder of a stage in place, by a dose."""
