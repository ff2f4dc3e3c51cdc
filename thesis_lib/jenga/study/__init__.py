"""The study of chapter 5: collection of samples, games, learned models, showcases."""
