"""Contracts that every stage and every source keeps."""
