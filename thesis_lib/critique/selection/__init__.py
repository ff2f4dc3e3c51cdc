"""The search that every critique shares: which effect a model lacks, and which effects cannot be told apart."""
