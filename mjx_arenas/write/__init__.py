"""What MuJoCo derives from a model's other fields, in JAX: traced, batched, and of models that differ between worlds."""
