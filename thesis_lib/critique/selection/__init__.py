"""The search that all critiques share: which effect a model lacks, and which effects cannot be told apart."""
