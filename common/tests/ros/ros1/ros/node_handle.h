// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

/// Stand-in for roscpp: the few functions that the glue calls, with the same names.
namespace boost {
template <class Signature>
using function = std::function<Signature>;
}  // namespace boost

namespace XmlRpc {

class XmlRpcValue {
  public:
    enum Type { TypeInvalid, TypeBoolean, TypeInt, TypeDouble, TypeString, TypeArray };
    XmlRpcValue() = default;
    XmlRpcValue(bool v) : type_(TypeBoolean), bool_(v) {}
    XmlRpcValue(int v) : type_(TypeInt), int_(v) {}
    XmlRpcValue(double v) : type_(TypeDouble), double_(v) {}
    XmlRpcValue(const char* v) : type_(TypeString), string_(v) {}
    XmlRpcValue(const std::vector<double>&) : type_(TypeArray) {}
    Type getType() const { return type_; }
    operator bool&() { return bool_; }
    operator int&() { return int_; }
    operator double&() { return double_; }
    operator std::string&() { return string_; }

  private:
    Type type_ = TypeInvalid;
    bool bool_ = false;
    int int_ = 0;
    double double_ = 0.0;
    std::string string_;
};

}  // namespace XmlRpc

namespace ros {

class Time {
  public:
    void fromSec(double t) { seconds_ = t; }
    double toSec() const { return seconds_; }

  private:
    double seconds_ = 0.0;
};

template <class Message>
using Log = std::vector<std::pair<std::string, Message>>;

template <class Message>
struct LoggingPublisher {
    std::string topic;
    std::shared_ptr<Log<Message>> log;
    void publish(const Message& message) const { log->emplace_back(topic, message); }
};
struct Subscriber {
    std::shared_ptr<void> alive;
};

class NodeHandle {
  public:
    std::map<std::string, XmlRpc::XmlRpcValue> parameters;  ///< by absolute name
    std::vector<std::string> advertised;
    std::shared_ptr<void> log;  ///< Log<Message> of the advertised topic
    std::string subscribed;
    std::shared_ptr<void> callback;  ///< std::function<void(const MessageConstPtr&)>

    std::string resolveName(const std::string& name) const { return "/robot/" + name; }
    bool getParamNames(std::vector<std::string>& names) const {
        for (const auto& p : parameters) names.push_back(p.first);
        return true;
    }
    bool getParam(const std::string& name, XmlRpc::XmlRpcValue& out) const {
        const auto found = parameters.find(name);
        if (found == parameters.end()) return false;
        out = found->second;
        return true;
    }
    template <class Message>
    LoggingPublisher<Message> advertise(const std::string& topic, std::uint32_t) {
        advertised.push_back(topic);
        const auto messages = std::make_shared<Log<Message>>();
        log = messages;
        return {topic, messages};
    }
    template <class Message>
    Subscriber subscribe(const std::string& topic, std::uint32_t,
                         const std::function<void(const std::shared_ptr<const Message>&)>& f) {
        subscribed = topic;
        callback = std::make_shared<std::function<void(const std::shared_ptr<const Message>&)>>(f);
        return {callback};
    }
};

}  // namespace ros
