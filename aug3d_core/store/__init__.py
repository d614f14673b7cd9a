"""Immutable, content-addressed outputs: records, keys, commit, verification, locks. The only place that spells a path."""
