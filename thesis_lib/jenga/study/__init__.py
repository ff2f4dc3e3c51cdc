"""The study of chapter 5: samples, games, what is learned, what is shown."""
