// SPDX-License-Identifier: Apache-2.0
// Values cached by key within a memory bound, least recently used evicted first. A value is loaded
// once even if several threads request it at the same time.
#pragma once
#include <condition_variable>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <utility>

namespace gflow {

template <class Key, class Value>
class LruCache {
 public:
  explicit LruCache(size_t capacity) : capacity_(capacity) {}

  // The value of a key. If it is absent, load() creates it and bytes(value) is its size. An
  // exception of load() propagates, and the next call tries again.
  template <class Load, class Size>
  std::shared_ptr<const Value> get(const Key& key, Load&& load, Size&& bytes) {
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
      const auto found = entries_.find(key);
      if (found != entries_.end()) {
        order_.splice(order_.begin(), order_, found->second.place);
        return found->second.value;
      }
      if (!loading_.count(key)) break;
      loaded_.wait(lock);
    }
    loading_.insert(key);
    lock.unlock();
    std::shared_ptr<const Value> value;
    try {
      value = std::make_shared<const Value>(load());
    } catch (...) {
      lock.lock();
      loading_.erase(key);
      loaded_.notify_all();
      throw;
    }
    lock.lock();
    loading_.erase(key);
    keep(key, value, bytes(*value));
    loaded_.notify_all();
    return value;
  }

 private:
  struct Entry {
    std::shared_ptr<const Value> value;
    size_t bytes;
    typename std::list<Key>::iterator place;
  };

  void keep(const Key& key, const std::shared_ptr<const Value>& value, size_t bytes) {
    order_.push_front(key);
    entries_[key] = {value, bytes, order_.begin()};
    used_ += bytes;
    while (used_ > capacity_ && order_.size() > 1) {
      const auto oldest = entries_.find(order_.back());
      used_ -= oldest->second.bytes;
      entries_.erase(oldest);
      order_.pop_back();
    }
  }

  size_t capacity_, used_ = 0;
  std::mutex mutex_;
  std::condition_variable loaded_;
  std::list<Key> order_;  // most recently used first
  std::map<Key, Entry> entries_;
  std::set<Key> loading_;
};

}  // namespace gflow
