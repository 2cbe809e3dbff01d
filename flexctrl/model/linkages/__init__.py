"""Nodes that follow others; loops of rigid parts."""
