"""Arenas in environments of reinforcement learning."""
