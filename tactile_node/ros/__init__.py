"""Code that all ROS nodes share: conversion and checks of messages, parameters and QoS profiles."""
