"""Any renderer against scenes whose answers are known: cases, writers of scenes, how to ask, and verdicts."""
