"""Generalised alpha: its steps one by one."""
