"""Contact models in robotic manipulation: reproduce, criticise, augment, learn the rest."""
