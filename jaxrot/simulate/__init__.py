"""`python -m jaxrot simulate SCENE`: runs a scene, draws it, and says how it fared."""
