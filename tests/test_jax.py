"""What this library needs of JAX itself."""

import subprocess
import sys

import pytest

CODE = """
import jax, jax.numpy as jnp

@jax.jit
def f(a, b):
    def body(c, _):
        return c + 0 * (jnp.linalg.cholesky(a + c).sum() + jnp.linalg.cholesky(b + c).sum()), None
    return jax.lax.scan(body, jnp.float32(0), length=50)[0]

a = jnp.broadcast_to(30 * jnp.eye(24), (1024, 24, 24))
for _ in range(20):
    f(a, a).block_until_ready()
"""


@pytest.mark.xslow
@pytest.mark.slow
def test_two_batched_choleskys_do_not_deadlock():
    """jax 0.10.0 to 0.11.1 hang here on two cores, and so would a step of MJX: they are excluded in pyproject.toml."""
    assert subprocess.run([sys.executable, "-c", CODE], timeout=120, check=False).returncode == 0
