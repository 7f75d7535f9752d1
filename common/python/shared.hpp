// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <mutex>
#include <utility>

namespace d2lio::python {

/// An object that any number of Python threads may call: the interpreter's lock is given up first,
/// so that a long call holds nobody else, and calls take turns.
template <typename T>
class Shared {
  public:
    template <typename... Args>
    explicit Shared(Args&&... args) : object_(std::forward<Args>(args)...) {}

    Shared(const Shared&) = delete;
    Shared(Shared&&) = delete;

    template <typename F>
    auto call(const F& f) {
        nanobind::gil_scoped_release release;
        const std::lock_guard lock(mutex_);
        return f(object_);
    }

  private:
    std::mutex mutex_;
    T object_;
};

}  // namespace d2lio::python
