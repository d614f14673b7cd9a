"""Immutable, content-addressed outputs: records, keys, atomic commit, verification, locks. The only place that spells a path."""
