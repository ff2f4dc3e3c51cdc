"""The study of chapter 5: samples, games, learned models, showcases."""
